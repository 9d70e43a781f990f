"""File formats: JSON frames and lines, KITTI's result text."""
