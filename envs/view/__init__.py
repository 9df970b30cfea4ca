"""Pictures, cameras and reports."""
