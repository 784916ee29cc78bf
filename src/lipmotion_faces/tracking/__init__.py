"""Face tracking: videos to motion and mouth pictures."""
