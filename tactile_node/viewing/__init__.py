"""Views of a bus, a recording or a bag: the live page, the terminal view and the report, and the facts behind them."""
