"""What the robots and their operators are seen and felt with: hand tracking, fibre gratings, cameras."""
