# drake_rnn with films, compiled laws, drawings of the wiring and what needs no licence of others:
#   docker build --tag drake-rnn .
#   docker run --rm -v "$PWD/out:/work/out" drake-rnn run slc_nephroid_warm_up
#   docker run --rm -p 127.0.0.1:8040:8040 drake-rnn live slc_nephroid_known --host 0.0.0.0
FROM python:3.12-slim-bookworm AS build
WORKDIR /source
COPY . .
RUN pip install --no-cache-dir build && python -m build --wheel --outdir /dist .

FROM python:3.12-slim-bookworm
# Of Drake: glib and EGL. Chromium is for films, gcc for compiled laws, Graphviz for wirings.
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
       chromium chromium-driver gcc graphviz libc6-dev libegl1 libgl1-mesa-dri libglib2.0-0 \
    && rm -rf /var/lib/apt/lists/*
COPY --from=build /dist/*.whl /dist/
COPY requirements.lock /dist/
RUN pip install --no-cache-dir --constraint /dist/requirements.lock \
    "drake-rnn[film,jax,svg,xacro] @ file://$(ls /dist/*.whl)"
# Nothing here needs root.
RUN useradd --create-home user && mkdir /work && chown user /work
USER user
WORKDIR /work
ENV MPLBACKEND=Agg
ENTRYPOINT ["drake-rnn"]
CMD ["--help"]
