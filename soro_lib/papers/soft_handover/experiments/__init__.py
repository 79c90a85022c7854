"""The experiments of Vervloet, A first step to visual servoing based autonomous handovers with soft robots.

``handover``: one run, experiment 1, Table 1; ``guidance``: experiment 2; ``use_case``: experiment 3;
``variants``: what the printed algorithm does; ``improvements``: the thesis's suggestions; ``faults``;
``findings``: all of it for the scorecard.
"""
