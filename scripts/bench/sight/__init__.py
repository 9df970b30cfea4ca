"""How near pictures are to others' rays and light: what `haustra bench sight` measures."""
