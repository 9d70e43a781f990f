# The command line in a container, made of this checkout:
#   docker build -t groundpose .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/data" groundpose estimate street.png --boxes boxes.json --calib camera.json -o poses.jsonl
# With extras: docker build --build-arg EXTRAS=video,mcap,ros -t groundpose .

FROM rust:1-slim-bookworm AS wheel
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3 python3-venv \
    && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /maturin && /maturin/bin/pip install --no-cache-dir 'maturin>=1.9,<2'
WORKDIR /source
COPY . .
RUN /maturin/bin/maturin build --release --locked --compatibility linux --out /wheels

FROM python:3.12-slim-bookworm
ARG EXTRAS=
RUN --mount=type=bind,from=wheel,source=/wheels,target=/wheels \
    pip install --no-cache-dir "$(ls /wheels/*.whl)${EXTRAS:+[$EXTRAS]}"
# without a folder of the caller's, results go to one of its own
RUN useradd --create-home --uid 1000 groundpose \
    && install --directory --owner=groundpose --group=groundpose /data
USER groundpose
ENV MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /data
ENTRYPOINT ["groundpose"]
CMD ["--help"]
