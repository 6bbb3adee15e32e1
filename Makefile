# Two commands do all set-up: `make demo` and `make test`. Everything lives in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Test files side by side, one core each: threads of several processes would wait for each other.
# Python keeps the compiled modules even where the environment forbids it: half of the collection.
PARALLEL := OMP_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE=
PROMPT ?= in a meadow, a turquoise rounded block slides to the left

.PHONY: demo test test-all lint clean

$(VENV)/ready: pyproject.toml setup.py constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip "setuptools>=77"
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[dev]'
	touch $@

demo: $(VENV)/ready  ## a drawn world's first picture to a scene that moves; PHOTO=mine.jpg takes yours too
	$(BIN)/python examples/make_world_picture.py demo/picture.jpg
	$(BIN)/diff4splat generate demo/picture.jpg --camera arc:0.2 --prompt "$(PROMPT)" --out demo/scene
	@echo "look at demo/scene/preview.png and demo/scene/video.mp4"
ifdef PHOTO
	$(BIN)/diff4splat generate $(PHOTO) --camera arc:0.2 --out demo/photo-scene
	@echo "look at demo/photo-scene/preview.png and demo/photo-scene/video.mp4"
endif

test: $(VENV)/ready  ## in less than ten minutes on two cores: all that needs no GPU and is not marked slow
	$(PARALLEL) $(BIN)/pytest -q -m "not slow" -n auto --dist loadfile

test-all: $(VENV)/ready  ## the same and the slow tests
	$(PARALLEL) $(BIN)/pytest -q -n auto --dist loadfile

lint: $(VENV)/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

clean:
	rm -rf $(VENV) build dist *.egg-info demo out
