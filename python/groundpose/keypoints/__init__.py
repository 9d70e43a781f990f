"""From an image and boxes to keypoints: crops, the network, its scores, and the whole way to poses."""
