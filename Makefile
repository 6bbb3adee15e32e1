# Two commands do all set-up: `make demo` and `make test`. Everything lives in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Test files side by side, one core each: threads of several processes would wait for each other.
# Python keeps the compiled modules even where the environment forbids it: half of the collection.
PARALLEL := OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=
PROMPT ?= in a meadow, a turquoise rounded block slides to the left

COUNT ?= 10000
SEED ?= 0

.PHONY: demo gallery test test-all test-browser fuzz lint clean

$(VENV)/ready: pyproject.toml setup.py constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "setuptools>=77"
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	touch $@

demo: $(VENV)/ready  ## a drawn world's first picture to a scene that moves; PHOTO=mine.jpg takes yours too
	$(BIN)/python examples/make_world_picture.py demo/picture.jpg
	$(BIN)/diff4splat generate demo/picture.jpg --camera arc:0.2 --prompt "$(PROMPT)" --out demo/scene
	@echo "look at demo/scene/preview.png and the video beside it"
ifdef PHOTO
	$(BIN)/diff4splat generate $(PHOTO) --camera arc:0.2 --out demo/photo-scene
	@echo "look at demo/photo-scene/preview.png and the video beside it"
endif

gallery: $(VENV)/ready  ## a dozen scenes on one page, gallery/index.html; minutes; goes on after a stop
	$(BIN)/python -m examples.gallery --out gallery

test: $(VENV)/ready  ## all that needs no GPU and is not marked slow: a quarter of an hour on two slow cores
	$(PARALLEL) $(BIN)/pytest -q -m "not slow" -n auto --dist loadfile --durations=40 --durations-min=4

test-all: $(VENV)/ready  ## the same and the slow tests
	$(PARALLEL) $(BIN)/pytest -q -n auto --dist loadfile

test-browser: $(VENV)/ready  ## the viewer's page in Chromium, which must be installed
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[browser]'
	$(PARALLEL) $(BIN)/pytest -q tests/browser

fuzz: $(VENV)/ready  ## damaged files for every reader; READER=ply COUNT=500 SEED=3 narrow it down
	PYTHONPATH=tests:tests/support OMP_NUM_THREADS=1 nice -n 19 $(BIN)/python -m fuzz \
		--count $(COUNT) --seed $(SEED) $(if $(READER),--reader "$(READER)")

lint: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

clean:
	rm -rf $(VENV) build dist *.egg-info demo gallery out
