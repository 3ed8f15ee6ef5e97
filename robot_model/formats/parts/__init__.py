"""What readers of robot formats share: drafts of robots, markup, mass properties, poses, notes."""
