"""Cars: plan, shell, fittings."""
