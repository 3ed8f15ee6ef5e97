"""A separate process for formats whose library may crash, or take any amount of memory or time."""
