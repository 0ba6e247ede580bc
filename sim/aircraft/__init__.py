"""The aircraft, one folder each: geometry and trim (``airframe.toml``), JSBSim model, build script and sources."""
