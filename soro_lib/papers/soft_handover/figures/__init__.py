"""The figures: ``handovers`` draws arms and runs, ``vision`` what the cameras see and miss; no simulation."""
