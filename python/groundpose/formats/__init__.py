"""File formats in and out, each in a file of its own.

Frames: `frames` (JSON). Boxes: `boxes`, and of any detector as it gives them: `detections`. Cameras:
`calibrations` (the table of readers, which are in `cameras`), `camera_files` (writers). KITTI: `kitti`
(results), `kitti_labels`, `kitti_dataset` (a folder), `kitti_table`. ApolloCar3D: `apollo`. COCO
keypoints: `coco_keypoints`. Other libraries: `conversions`, `rerun_log`. Other tools: `scenes`, `neighbours`,
`recordings`. What a reader left out: `skips`.
"""
