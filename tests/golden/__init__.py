"""Results that were right once, and the tests that say when they change."""
