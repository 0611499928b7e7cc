"""Draws how two servers take a newer goal and a cancel, as SVG, from what Benchmark.measure_timeline saw."""
import os
import tempfile

COLOURS = {"waits (PENDING)": "lightgray", "washes (ACTIVE)": "tab:blue", "asked to stop, washes on": "tab:orange"}


def took(seconds):
    return "%.0f ms" % (1e3 * seconds) if seconds >= 0.01 else "%.1f ms" % (1e3 * seconds)


def draw(lines, requests, path):
    """lines: [(title, [goal of Benchmark.measure_timeline])]; requests: [(s, what is asked for)]; path: the file."""
    with tempfile.TemporaryDirectory() as os.environ["MPLCONFIGDIR"]:
        import matplotlib
        matplotlib.use("svg")
        matplotlib.rcParams["svg.hashsalt"] = "actions_tutorial"
        from matplotlib import pyplot
        figure, all_axes = pyplot.subplots(len(lines), figsize=(9, 4.6), sharex=True)
        for axes, (title, goals) in zip(all_axes, lines):
            draw_server(axes, goals)
            axes.set_title(title, loc="left", fontsize=10, weight="bold", pad=30 if axes is all_axes[0] else 4)
            for second, what in requests:
                axes.axvline(second, color="black", linestyle=":", linewidth=1)
                if axes is all_axes[0]:
                    axes.annotate(what, (second, 1), (0, 16), xycoords=("data", "axes fraction"),
                                  textcoords="offset points", ha="center")
        all_axes[-1].set(xlabel="seconds since the first goal was sent", xlim=(-0.1, 7))
        handles = [matplotlib.patches.Patch(color=colour, label=state) for state, colour in COLOURS.items()]
        figure.legend(handles=handles, loc="lower center", ncol=3, frameon=False, bbox_to_anchor=(0.5, -0.07))
        figure.tight_layout()
        figure.savefig(path, format="svg", bbox_inches="tight", metadata={"Date": None, "Creator": None})


def draw_server(axes, goals):
    for y, goal in zip((1, 0), goals):
        spans = zip(COLOURS.values(), (goal["sent"], goal["active"], goal["stop"]),
                    (goal["active"], goal["stop"], goal["ended"]))
        for colour, begin, end in spans:
            axes.barh(y, end - begin, left=begin, height=0.34, color=colour)
        for name, second in goal["bowls"]:
            axes.plot(second, y, "o", color="white", markeredgecolor="black", markersize=6)
            axes.annotate(name, (second, y), (0, 12), textcoords="offset points", fontsize=8)
        axes.annotate("PREEMPTED after " + took(goal["ended"] - goal["stop"]), (goal["ended"], y), (5, 0),
                      textcoords="offset points", va="center", weight="bold", bbox={"color": "white", "pad": 1})
        if y == 0:
            axes.annotate("ACTIVE after " + took(goal["active"] - goal["sent"]), (goal["sent"], y), (-5, 0),
                          textcoords="offset points", ha="right", va="center", weight="bold")
    axes.set(yticks=(1, 0), yticklabels=("first goal", "newer goal"), ylim=(-0.5, 1.6))
    for side in "top", "right":
        axes.spines[side].set_visible(False)
