"""What all tests share: none fails for taking long, on whatever machine, and all try the same examples every time."""

from __future__ import annotations

import hypothesis

hypothesis.settings.register_profile("aerial", deadline=None, derandomize=True)
hypothesis.settings.load_profile("aerial")
