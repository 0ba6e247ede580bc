"""Picture of a Rerun recording, without a screen: python docs/images/picture.py FLIGHT.rrd SECONDS PICTURE.jpg

Needs a Vulkan driver; a processor will do (Debian: mesa-vulkan-drivers).
"""

import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from rerun.experimental import ViewerClient

from sim.view.viewer import await_port, executable, free_port

recording, seconds, picture = Path(sys.argv[1]).resolve(), float(sys.argv[2]), Path(sys.argv[3])
port = free_port()
# `ViewerClient.spawn` would listen on every interface of the machine.
viewer = subprocess.Popen(
    [executable(), "--headless", "--hide-welcome-screen", "--bind", "127.0.0.1", "--port", str(port)]
)
try:
    await_port(viewer, port)
    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    client.open(str(recording))
    time.sleep(3.0)  # it loads and compiles
    client.set_time("sim_time", duration=seconds, play_state="paused")
    time.sleep(2.0)  # it settles: then the same picture comes again, byte by byte
    with TemporaryDirectory() as folder:
        client.save_screenshot(f"{folder}/screen.png")
        image = Image.open(f"{folder}/screen.png").convert("RGB")
finally:
    viewer.terminate()
image = image.crop((0, 36, *image.size))  # without the empty bar on top
image = image.resize((1600, round(1600 * image.height / image.width)), Image.Resampling.LANCZOS)
image.save(picture, quality=86, subsampling=0, optimize=True)
