"""Keypoint networks measured: cost, accuracy on held-out crops, poses from them (paper, Tables 1 and 2)."""
