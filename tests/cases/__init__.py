"""Inputs that go wrong, as users reported them: ../shared/cases tells what must hold for each."""
