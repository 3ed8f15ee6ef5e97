"""Effects of a free base and of flexible links, found from channels besides the torques."""
