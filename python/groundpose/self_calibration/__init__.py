"""A camera calibrated by the vehicles that it sees: tilt, height, sizes of classes, focal length."""
