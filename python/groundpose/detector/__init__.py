"""2D boxes from a detector of the user's, in an ONNX file."""
