"""One scene, several backends: what each is held to, and how far apart they are."""
