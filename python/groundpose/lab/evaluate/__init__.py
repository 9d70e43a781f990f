"""Measuring: synthetic and real experiments with the contenders of `lab.contenders`.

A file imports only what stands before it: `scenes`, `real_data`, `rows`, `report`; rows of the table of
targets are in `guarantee`, `accuracy`, `honesty`, `cost`. The programs: `real` (real keypoints), `targets`
(what the solver must show), `kitti` and `apollo` (folders of real data; `tilt`: ways to use a nominal tilt;
`html`, `real_page`: their pages).
"""
