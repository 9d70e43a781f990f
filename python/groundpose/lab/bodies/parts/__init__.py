"""Parts that vehicles of all classes share, as closed components about their own origin."""
