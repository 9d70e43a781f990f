"""KITTI: results, labels, folders of frames, tables of vehicles."""
