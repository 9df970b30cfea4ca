"""One scene, several engines: what each is held to, and how far apart they are."""
