"""What all tests share: none fails for taking long, on whatever machine."""

from __future__ import annotations

import hypothesis

hypothesis.settings.register_profile("aerial", deadline=None)
hypothesis.settings.load_profile("aerial")
