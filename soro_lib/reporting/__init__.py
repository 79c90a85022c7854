"""From tables to pages: scorecards, equation indices, figures."""
