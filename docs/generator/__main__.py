"""`python -m docs.generator`: the pages in build/docs."""

from __future__ import annotations

from docs.generator.site import ROOT, gather

gather(ROOT / "build" / "docs")
