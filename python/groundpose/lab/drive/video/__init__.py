"""The virtual drive as video: vehicles that persist, with ids, speeds and yaw rates."""
