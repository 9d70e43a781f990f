"""Parts common to vehicles of all classes, as closed components about their own origin."""
