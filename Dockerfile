# A server on CPUs, without root and without compilers at run time.
#   docker build -t diff4splat .
#   docker run -p 8000:8000 -v diff4splat-jobs:/jobs -e DIFF4SPLAT_TOKEN=... diff4splat
FROM python:3.11-slim AS build
WORKDIR /source
COPY pyproject.toml setup.py constraints.txt README.md LICENSE ./
COPY diff4splat diff4splat
COPY models models
COPY training training
COPY data_prep data_prep
COPY configs configs
RUN python -m venv /opt/diff4splat \
 && /opt/diff4splat/bin/pip install --no-cache-dir -c constraints.txt '.[serve,onnx]' \
 && /opt/diff4splat/bin/diff4splat export onnx --model small --out /opt/graphs \
 && /opt/diff4splat/bin/pip uninstall --yes onnx onnxscript

FROM python:3.11-slim
RUN useradd --system --create-home --uid 10001 diff4splat \
 && mkdir /jobs && chown diff4splat /jobs
COPY --from=build /opt/diff4splat /opt/diff4splat
COPY --from=build /opt/graphs /opt/graphs
USER diff4splat
WORKDIR /home/diff4splat
VOLUME /jobs
EXPOSE 8000
HEALTHCHECK --interval=30s --timeout=3s CMD ["/opt/diff4splat/bin/python", "-c", \
  "import urllib.request as r; r.urlopen('http://127.0.0.1:8000/health/live', timeout=2)"]
STOPSIGNAL SIGTERM
CMD ["/opt/diff4splat/bin/diff4splat", "serve", "/opt/graphs", \
     "--folder", "/jobs", "--host", "0.0.0.0", "--port", "8000"]
