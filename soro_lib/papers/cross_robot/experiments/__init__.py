"""Every controller on every arm, and what comes of exchanging their ideas."""
