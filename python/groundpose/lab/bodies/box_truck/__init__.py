"""Box trucks: plan, shell, fittings."""
