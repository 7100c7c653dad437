"""``python -m app`` is ``levimass``."""

from app.cli import main

raise SystemExit(main())
