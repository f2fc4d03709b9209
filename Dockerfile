# weighbridge with live weighing. Build it on the computer that runs it: the kernels are compiled
# for its processor. docs/raspberry.md has the steps.
FROM python:3.12-slim-bookworm

RUN useradd --uid 1000 --create-home weighbridge \
 && install -d -o weighbridge -g weighbridge /data /kernels

COPY pyproject.toml README.md LICENSE /build/
COPY src /build/src
RUN pip install --no-cache-dir "/build[live,ble,mqtt,page]" && rm -r /build

USER weighbridge
ENV NUMBA_CACHE_DIR=/kernels
COPY examples/raspberry/compile.sh /compile.sh
RUN sh /compile.sh

WORKDIR /data
VOLUME /data
ENTRYPOINT ["weighbridge"]
CMD ["live", "--help"]
