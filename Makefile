# The commands of this repository. Each is a few lines; the work is in tools/.
#
#   make render     render examples/cornell_box.blend to out/
#   make test       lint and the test suite, on one Blender (make test BLENDER=4.5 for another)
#   make test-all   the suite on every Blender this machine can run, on OpenGL and on Vulkan
#   make test-window  the same extension in a real Blender window on a virtual screen, with mouse and keys
#                   (make test-window WINDOW="views --backend vulkan" for one scenario; needs root and network once)
#   make lint       the linters alone
#   make format     rewrite Python and GLSL the way lint wants them
#   make manual     docs/manual as web pages, into out/manual
#   make package    dist/rebound-<version>.zip, to install in Blender
#   make setup      only make the virtual environment
#   make bench      measure Rebound beside EEVEE and Cycles, into docs/performance.md (hours on software OpenGL;
#                   make bench BENCH="--quick --scenes cornell_box" for minutes)
#   make report     out/bench/report.html: the same pictures and figures, with a divider to drag
#   make bench-gpu  time every pass on this machine's GPU, without Blender (BENCH="SNAPSHOT.npz ...")
#   make clean      remove everything made here, virtual environments included

# Set-up needs a Python 3.11 or newer that runs (a pyenv shim on PATH may not).
PYTHON ?= $(shell for python in python3 python3.13 python3.11 /usr/bin/python3 $(HOME)/.pyenv/versions/3.1[13]*/bin/python3; do \
	"$$python" -c "import tomllib" 2>/dev/null && echo "$$python" && break; done)
BLENDER ?=
BENCH ?=
WINDOW ?=
VENV := $(if $(BLENDER),.venv-$(BLENDER),.venv)

.PHONY: render test test-all test-window lint format manual package setup setup-render bench report bench-gpu clean

render: setup-render
	@$(VENV)/bin/python tools/render_example.py

test: lint
	@$(VENV)/bin/python tools/run_tests.py

test-all: python
	@$(PYTHON) tools/test_all.py

test-window: setup-render
	@$(VENV)/bin/python tools/test_window.py $(WINDOW)

lint: setup
	@$(VENV)/bin/python tools/lint.py

format: setup
	@$(VENV)/bin/python tools/lint.py --fix

manual: setup
	@$(VENV)/bin/python tools/settings_page.py
	@NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict --quiet
	@echo "manual: out/manual/index.html"

package: setup-render
	@$(VENV)/bin/python tools/package.py

bench: setup
	@$(VENV)/bin/python benchmarks/bench.py $(BENCH)

report: setup
	@$(VENV)/bin/python benchmarks/bench.py --steps report $(BENCH)

# With any Python that has numpy and moderngl, where there is no virtual environment.
bench-gpu:
	@$(if $(wildcard $(VENV)/bin/python),$(VENV)/bin/python,$(PYTHON)) benchmarks/bench_gpu.py $(BENCH)

setup: python
	@$(PYTHON) tools/setup.py --for-tests --blender "$(BLENDER)"

setup-render: python
	@$(PYTHON) tools/setup.py --blender "$(BLENDER)"

.PHONY: python
python:
	@test -n "$(PYTHON)" || { echo "make: needs Python 3.11 or 3.13 and found neither (Debian: apt-get install python3 python3-venv)"; exit 1; }

clean:
	rm -rf .venv .venv-* .cache out dist wheels .pytest_cache .ruff_cache .hypothesis .import_linter_cache
