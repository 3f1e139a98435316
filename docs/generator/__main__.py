"""`python -m docs.generator`: the pages in build/docs. `--schema`: renews docs/schema/experiment.json instead."""

from __future__ import annotations

import sys

from docs.generator.site import ROOT, SCHEMA, gather, schema_text

if "--schema" in sys.argv[1:]:
    SCHEMA.write_text(schema_text(), encoding="utf-8")
else:
    gather(ROOT / "build" / "docs")
