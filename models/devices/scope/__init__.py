"""A `ScopeDesign` in; a composite cable with tendons, attached to an MjSpec, out."""
