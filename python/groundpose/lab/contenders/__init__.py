"""Ways to get poses that are compared: one interface, one table.

A file imports only what stands before it: `objects` (what every contender is given), `contender` (the
interface and what it answers), `own` (our solver and the paper's methods on it), `libraries` (PoseLib,
OpenCV, pycolmap), `oracle` (floors), `baselines` (PnP methods from papers), `polish` (a search followed by
one of them), `use` (with scores, at another threshold), `registry` (all of them, and where each takes part),
`styles` (how figures draw them).
"""
