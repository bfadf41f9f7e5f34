# All commands need Python 3.11, 3.12 or 3.13, a C++ compiler and cmake; see docs/installing.md.
PYTHON ?=
export PYTHON
RUN := scripts/workspace run
STUDIES := python -m studies

.PHONY: help demo view pictures renders docs test lint docs-check prepare fleet fleet-study bench studies robots load soak tune tuning fuzz contacts sanitize clean soil rover height-scan friction tracks laws records replay-speed

help:  ## this list
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

demo:  ## terrain, bodies and a robot on a moving elevation model, for 15 s
	@$(RUN) -- install/smartmesh_ros/lib/smartmesh_ros/smartmesh-demo

view:  ## a page in the browser that shows the demo's terrain, until Ctrl-C
	@$(RUN) view -- install/smartmesh_ros/lib/smartmesh_ros/view --demo

pictures:  ## the pictures of the view and the demo in docs/, by a browser without a window
	@$(RUN) dev view -- python -m scripts.view_pictures

renders:  ## the pictures that need no browser: rising ground, a lidar, and how contacts work
	@$(RUN) -- $(STUDIES) rising
	@$(RUN) -- $(STUDIES) lidar
	@$(RUN) -- $(STUDIES) contacts

docs:  ## the pages as a site with search and an API reference: site/index.html
	@$(RUN) docs -- mkdocs build --strict --quiet

test:  ## lint, types, colcon build, and every test (after the build 5 minutes on two cores)
	@$(RUN) dev view studies interop -- scripts/check

docs-check:  ## the tables of docs/ whose figures are older than the code
	@$(RUN) -- $(STUDIES) docs-check

lint:  ## ruff, the import rules and the type checker
	@$(RUN) dev view -- scripts/check lint

prepare:  ## environment and install/ only
	@scripts/workspace prepare

fleet:  ## four nodes on one terrain whose bodies meet, until Ctrl-C; ARGS="--nodes 2 --bodies 50 --seconds 20"
	@$(RUN) -- install/smartmesh_ros/lib/smartmesh_ros/smartmesh-fleet $(ARGS)

fleet-study:  ## how many bodies fleets carry in real time (about eight minutes)
	@$(RUN) load -- $(STUDIES) fleet

bench:  ## running times against the report's tables
	@$(RUN) studies -- $(STUDIES) bench

studies:  ## speed against accuracy, and the stability matrix (about 30 minutes; ARGS=--quick: two)
	@$(RUN) studies -- $(STUDIES) accuracy $(ARGS)

laws:  ## laws of contact, and how far runs drift apart, in each engine (about four minutes)
	@$(RUN) studies -- $(STUDIES) laws

records:  ## terrain tax, touchdown and size of cells, beside other engines (about four minutes)
	@$(RUN) studies -- $(STUDIES) records

robots:  ## robots on rough and moving ground, beside other engines (about seven minutes; ARGS=--quick: two)
	@$(RUN) studies -- $(STUDIES) robots $(ARGS)

friction:  ## boxes slide on ice beside gravel, against v^2 / (2 mu g): docs/images/friction.png
	@$(RUN) -- $(STUDIES) friction

height-scan:  ## what a legged robot's policy observes of moving ground, printed and drawn: out/height_scan.png
	@$(RUN) -- python -m scripts.height_scan $(ARGS)

rover:  ## a wheeled robot drives an eight on soil and leaves ruts: docs/images/soil/rover.png
	@$(RUN) studies -- $(STUDIES) rover

tracks:  ## a tracked machine drives, turns on the spot and climbs 20 degrees on soil: docs/images/tracks.png
	@$(RUN) studies -- $(STUDIES) tracks

soil:  ## soil against closed forms and a measured wheel, and its cost (ARGS="--only boxes" for a part)
	@$(RUN) studies -- $(STUDIES) soil $(ARGS)

load:  ## the node under load over DDS, about eight minutes; LOAD="--only rest" for a table
	@$(RUN) load -- $(STUDIES) load $(LOAD)

soak:  ## ten minutes of everything changing; SOAK="--minutes 120" for two hours, --document for docs/
	@$(RUN) load -- $(STUDIES) soak $(SOAK)

replay-speed:  ## how much faster than real time a replay runs: the table of docs/replay.md
	@$(RUN) replay -- $(STUDIES) replay

tune:  ## parameters for a budget, on a scene that ships: SOURCE=stairs or a bag, ARGS="--budget 0.1 --jobs 2"
	@$(RUN) replay -- install/smartmesh_ros/lib/smartmesh_ros/tune $(or $(SOURCE),waves_w04_maps_20) $(ARGS)

tuning:  ## the table of docs/tuning.md: three scenes and a bag of the demo, about five minutes
	@$(RUN) replay -- $(STUDIES) tuning

fuzz:  ## 120,000 spoilt messages for every topic, service and parameter (half an hour)
	@$(RUN) dev -- python -m tests.fuzz.run --jobs 2

contacts:  ## the core's contacts against the library coal: 100,000 random poses of each shape (about an hour)
	@$(RUN) dev studies -- env CONTACT_POSES=100000 python -m pytest -q -n auto tests/core/test_contacts_coal.py

sanitize:  ## the core's tests and 30 s of mixed scenes under AddressSanitizer and UBSan (two minutes; SECONDS=5 for fewer)
	@$(RUN) dev studies -- python scripts/sanitize.py $(SECONDS)

clean:  ## remove the environment and all builds; pictures and files in out/ and site/ stay
	rm -rf .venv build install log
