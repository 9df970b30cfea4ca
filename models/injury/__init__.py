"""What a device does to a colon's wall: tears, bleeding and pain, as laws of forces that backends already know."""
