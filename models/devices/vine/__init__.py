"""An everting endoscope that grows at its tip: what has been laid does not slide on the wall."""
