"""Bodies and joints of the robot as plain numbers: rotations, mechanism, flexible links, bearings."""
