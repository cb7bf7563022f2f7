"""Networks that detect: which there are, how real ones are fetched and converted, and which one runs."""
