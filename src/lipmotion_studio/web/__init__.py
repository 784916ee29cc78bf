"""What the pages that lipmotion serves share: listening, security headers, bodies, replies to errors (extras)."""
