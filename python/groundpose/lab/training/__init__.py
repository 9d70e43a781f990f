"""Training of the keypoint network (extra `[train]`): networks, data, loop, evaluation, export."""
