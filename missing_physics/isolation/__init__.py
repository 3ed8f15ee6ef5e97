"""A separate process for formats whose library may crash, or take any amount of memory or time.

It stands apart from the packages that use it, because the process imports `limits` and nothing else of this
program: importing a whole package of readers would take longer than most files.
"""
