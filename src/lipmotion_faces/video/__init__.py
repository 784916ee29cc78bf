"""Writers of videos."""
