"""What a learner is asked to do: cases, what it sees, what it is paid for, and when an episode ends."""
