"""The studio: a page on which motion is seen, edited, approved and handed over (docs/studio.md)."""
