"""Networks that detect."""
