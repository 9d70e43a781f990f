"""The colours of all pictures: Okabe and Ito's, told apart with any colour vision."""

POSE, POSE_LIGHT, FRONT, TRUTH, BOX = "#0072B2", "#56B4E9", "#F0E442", "#000000", "#E69F00"
INLIER, OUTLIER, MISSING, NO_POSE, SPREAD = "#009E73", "#D55E00", "#999999", "#CC79A7", "#D55E00"
PAPER, GRID = "#FFFFFF", "#DDDDDD"
