"""The console's page, as it was built from `source/` by `make page`."""
