"""Who drives: follower, gestures, haptic handle, steering of the tracked robot."""
