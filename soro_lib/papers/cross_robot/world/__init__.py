"""The four arms as they are shown, and on the bench: as a controller sees them, and as they really are."""
