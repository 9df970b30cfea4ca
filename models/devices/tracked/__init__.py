"""The tracked robot: its tread, its tread reference, its struts and drive, and how it stands in a scene."""
