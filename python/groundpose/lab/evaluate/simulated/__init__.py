"""The paper's G1 and G2 (sec. 4.2, Table 2) on the virtual drive, with a simulated detector.

A file imports only what stands before it: `box_noise` and `keypoint_noise` (the detector, numbers measured on
KITTI), `fit` (where those numbers come from), `objects` (vehicles of the drive), `run`,
`page`.
"""
