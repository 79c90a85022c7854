"""What the thesis had in hardware: the sagging arm (``plant``), room and pictures (``scene``), and the eyes
(``observer``); no controller and no experiment."""
