"""The aeroplanes, a folder each: numbers, the JSBSim model made from them, and where each figure comes from."""
